// Files: STEP with product structure, names and colours through XCAF; BREP; IGES.
#include "grassfire-occt/cpp/bridge.h"
#include "grassfire-occt/src/ffi.rs.h"

#include <map>
#include <stdexcept>

#include <APIHeaderSection_MakeHeader.hxx>
#include <BRepTools.hxx>
#include <BRep_Builder.hxx>
#include <IFSelect_ReturnStatus.hxx>
#include <IGESControl_Controller.hxx>
#include <IGESControl_Reader.hxx>
#include <IGESControl_Writer.hxx>
#include <IGESData_GlobalSection.hxx>
#include <IGESData_IGESModel.hxx>
#include <Interface_Static.hxx>
#include <Quantity_Color.hxx>
#include <STEPCAFControl_Controller.hxx>
#include <STEPCAFControl_Reader.hxx>
#include <STEPCAFControl_Writer.hxx>
#include <STEPConstruct.hxx>
#include <STEPControl_Reader.hxx>
#include <StepBasic_Product.hxx>
#include <StepData_StepModel.hxx>
#include <StepRepr_RepresentationItem.hxx>
#include <TCollection_ExtendedString.hxx>
#include <TCollection_HAsciiString.hxx>
#include <TDF_Label.hxx>
#include <TDF_LabelSequence.hxx>
#include <TDataStd_Name.hxx>
#include <TDocStd_Document.hxx>
#include <TopExp.hxx>
#include <TopTools_FormatVersion.hxx>
#include <TopTools_IndexedMapOfShape.hxx>
#include <TopoDS_Compound.hxx>
#include <Transfer_FinderProcess.hxx>
#include <XCAFDoc_ColorTool.hxx>
#include <XCAFDoc_DocumentTool.hxx>
#include <XCAFDoc_ShapeTool.hxx>
#include <XSControl_TransferWriter.hxx>
#include <XSControl_WorkSession.hxx>

namespace grassfire {
namespace {

Handle(TCollection_HAsciiString) text(const rust::String& s) { return new TCollection_HAsciiString(std::string(s).c_str()); }

void set_name(const TDF_Label& label, const rust::String& name) {
  TDataStd_Name::Set(label, TCollection_ExtendedString(std::string(name).c_str(), true));
}

std::string name_of(const TDF_Label& label) {
  Handle(TDataStd_Name) name;
  if (label.IsNull() || !label.FindAttribute(TDataStd_Name::GetID(), name)) return "";
  return TCollection_AsciiString(name->Get()).ToCString();
}

// Red, green and blue of 8 bits each, as screens take them.
Quantity_Color color(uint32_t rgb) {
  const auto part = [rgb](int shift) { return double(rgb >> shift & 255) / 255.; };
  return Quantity_Color(part(16), part(8), part(0), Quantity_TOC_sRGB);
}

int64_t rgb(const Quantity_Color& c) {
  double r, g, b;
  c.Values(r, g, b, Quantity_TOC_sRGB);
  const auto part = [](double x) { return int64_t(x * 255. + 0.5); };
  return part(r) << 16 | part(g) << 8 | part(b);
}

// The colours of a solid's faces: the one that most faces have is the solid's own, the others are exceptions from it.
void paint(const Handle(XCAFDoc_ShapeTool)& shapes, const Handle(XCAFDoc_ColorTool)& colors, const TDF_Label& part, const TopoDS_Shape& solid,
           const TopTools_IndexedMapOfShape& faces, const rust::Vec<uint32_t>& wanted) {
  TopTools_IndexedMapOfShape own;
  TopExp::MapShapes(solid, TopAbs_FACE, own);
  const auto of = [&](int i) { return wanted[size_t(faces.FindIndex(own(i))) - 1]; };
  std::map<uint32_t, int> count;
  for (int i = 1; i <= own.Extent(); ++i) ++count[of(i)];
  uint32_t most = 0;
  int best = 0;
  for (const auto& [value, n] : count)
    if (n > best) most = value, best = n;
  colors->SetColor(part, color(most), XCAFDoc_ColorSurf);
  for (int i = 1; i <= own.Extent(); ++i) {
    if (of(i) == most) continue;
    const TDF_Label face = shapes->AddSubShape(part, own(i));
    if (!face.IsNull()) colors->SetColor(face, color(of(i)), XCAFDoc_ColorSurf);
  }
}

// One product for one solid; an assembly with one product for each of several.
Handle(TDocStd_Document) document(const TopoDS_Shape& shape, const StepNames& names) {
  Handle(TDocStd_Document) out = new TDocStd_Document("BinXCAF");
  XCAFDoc_DocumentTool::SetLengthUnit(out, 1., UnitsMethods_LengthUnit_Millimeter);
  const Handle(XCAFDoc_ShapeTool) shapes = XCAFDoc_DocumentTool::ShapeTool(out->Main());
  const Handle(XCAFDoc_ColorTool) colors = XCAFDoc_DocumentTool::ColorTool(out->Main());
  TopTools_IndexedMapOfShape faces, solids;
  TopExp::MapShapes(shape, TopAbs_FACE, faces);
  TopExp::MapShapes(shape, TopAbs_SOLID, solids);
  const bool painted = names.colors.size() == size_t(faces.Extent());
  if (solids.Extent() < 2) {
    const TDF_Label part = shapes->AddShape(solids.IsEmpty() ? shape : solids(1), false);
    set_name(part, names.product);
    if (painted) paint(shapes, colors, part, shape, faces, names.colors);
    return out;
  }
  const TDF_Label assembly = shapes->NewShape();
  set_name(assembly, names.product);
  for (int i = 1; i <= solids.Extent(); ++i) {
    const TDF_Label part = shapes->AddShape(solids(i), false);
    const TDF_Label component = shapes->AddComponent(assembly, part, TopLoc_Location());
    const rust::String name = size_t(i) <= names.solids.size() ? names.solids[size_t(i) - 1] : names.product;
    set_name(part, name);
    set_name(component, name);
    if (painted) paint(shapes, colors, part, solids(i), faces, names.colors);
  }
  shapes->UpdateAssemblies();
  return out;
}

// Names of the representation items: the writer leaves them empty, or writes them only for faces that have a label.
void name_items(const Handle(Transfer_FinderProcess)& finder, const TopoDS_Shape& shape, TopAbs_ShapeEnum type, const rust::Vec<rust::String>& names) {
  TopTools_IndexedMapOfShape map;
  TopExp::MapShapes(shape, type, map);
  for (int i = 1; i <= map.Extent() && size_t(i) <= names.size(); ++i) {
    if (names[size_t(i) - 1].empty()) continue;
    const Handle(StepRepr_RepresentationItem) item = STEPConstruct::FindEntity(finder, map(i));
    if (!item.IsNull()) item->SetName(text(names[size_t(i) - 1]));
  }
}

void fill_header(const Handle(StepData_StepModel)& model, const StepNames& names) {
  APIHeaderSection_MakeHeader header(model);
  header.SetName(text(names.product));
  header.SetAuthorValue(1, text(names.author));
  header.SetOrganizationValue(1, text(names.organization));
  header.SetOriginatingSystem(text(names.system));
  header.SetAuthorisation(text(rust::String("")));
  header.SetDescriptionValue(1, text(names.description));
  if (!names.time_stamp.empty()) header.SetTimeStamp(text(names.time_stamp));
}

// The id of a product is what some systems show: the writer leaves a counter of the whole process there.
void name_products(const Handle(StepData_StepModel)& model) {
  for (int i = 1; i <= model->NbEntities(); ++i) {
    const Handle(StepBasic_Product) product = Handle(StepBasic_Product)::DownCast(model->Value(i));
    if (!product.IsNull()) product->SetId(product->Name());
  }
}

// The accuracy that the file claims: that of its worst edge.
void set_uncertainty(double value) {
  constexpr int given = 2;
  Interface_Static::SetIVal("write.precision.mode", given);
  Interface_Static::SetRVal("write.precision.val", value);
}

template <typename Reader>
std::unique_ptr<Shape> transferred(Reader& reader, const char* kind) {
  reader.TransferRoots();
  auto out = std::make_unique<Shape>();
  out->shape = reader.OneShape();
  if (out->shape.IsNull()) throw std::runtime_error(std::string("the ") + kind + " file holds no shape");
  return out;
}

}  // namespace

std::unique_ptr<Shape> read_step(rust::Str path) {
  STEPControl_Reader reader;
  Interface_Static::SetCVal("xstep.cascade.unit", "MM");
  if (reader.ReadFile(std::string(path).c_str()) != IFSelect_RetDone) throw std::runtime_error("not a readable STEP file");
  return transferred(reader, "STEP");
}

void write_step(const Shape& s, rust::Str path, const StepNames& names) {
  // Order matters: without Init the settings do not exist yet, and the writer takes the schema when it is made.
  STEPCAFControl_Controller::Init();
  if (!Interface_Static::SetIVal("write.step.schema", 5)) throw std::runtime_error("this OpenCASCADE cannot write STEP AP242");
  Interface_Static::SetCVal("write.step.unit", "MM");
  Interface_Static::SetIVal("write.step.assembly", 2);  // as the document has it
  Interface_Static::SetCVal("write.step.product.name", std::string(names.product).c_str());
  set_uncertainty(names.uncertainty);
  STEPCAFControl_Writer writer;
  writer.SetLayerMode(false);
  writer.SetPropsMode(false);
  writer.SetSHUOMode(false);
  writer.SetDimTolMode(false);
  writer.SetMaterialMode(false);
  if (!writer.Transfer(document(s.shape, names), STEPControl_AsIs)) throw std::runtime_error("the shape could not be translated to STEP");
  STEPControl_Writer& inner = writer.ChangeWriter();
  const Handle(Transfer_FinderProcess)& finder = inner.WS()->TransferWriter()->FinderProcess();
  name_items(finder, s.shape, TopAbs_FACE, names.faces);
  name_items(finder, s.shape, TopAbs_SOLID, names.solids);
  name_products(inner.Model());
  fill_header(inner.Model(), names);
  if (writer.Write(std::string(path).c_str()) != IFSelect_RetDone) throw std::runtime_error("the STEP file could not be written");
}

StepContents step_contents(rust::Str path) {
  STEPCAFControl_Controller::Init();
  Interface_Static::SetIVal("read.stepcaf.subshapes.name", 1);
  STEPCAFControl_Reader reader;
  if (reader.ReadFile(std::string(path).c_str()) != IFSelect_RetDone) throw std::runtime_error("not a readable STEP file");
  Handle(TDocStd_Document) file = new TDocStd_Document("BinXCAF");
  if (!reader.Transfer(file)) throw std::runtime_error("the STEP file holds no shape");
  const Handle(XCAFDoc_ShapeTool) shapes = XCAFDoc_DocumentTool::ShapeTool(file->Main());
  const Handle(XCAFDoc_ColorTool) colors = XCAFDoc_DocumentTool::ColorTool(file->Main());
  const auto color_of = [&](const TDF_Label& label, int64_t otherwise) {
    Quantity_Color found;
    const bool has = !label.IsNull() && (colors->GetColor(label, XCAFDoc_ColorSurf, found) || colors->GetColor(label, XCAFDoc_ColorGen, found));
    return has ? rgb(found) : otherwise;
  };
  StepContents out;
  TDF_LabelSequence labels;
  shapes->GetShapes(labels);
  for (const TDF_Label& label : labels) {
    if (!shapes->IsTopLevel(label)) continue;
    out.products.push_back(rust::String::lossy(name_of(label)));
    if (XCAFDoc_ShapeTool::IsAssembly(label)) continue;
    const TopoDS_Shape shape = XCAFDoc_ShapeTool::GetShape(label);
    const auto sub_label = [&](const TopoDS_Shape& part) {
      TDF_Label found;
      if (part.IsSame(shape)) return label;
      shapes->FindSubShape(label, part, found);
      return found;
    };
    TopTools_IndexedMapOfShape solids, faces;
    TopExp::MapShapes(shape, TopAbs_SOLID, solids);
    TopExp::MapShapes(shape, TopAbs_FACE, faces);
    int64_t main = color_of(label, -1);
    for (int i = 1; i <= solids.Extent(); ++i) {
      const TDF_Label solid = sub_label(solids(i));
      main = color_of(solid, main);
      out.solids.push_back(rust::String::lossy(name_of(solid)));
    }
    for (int i = 1; i <= faces.Extent(); ++i) {
      const TDF_Label face = sub_label(faces(i));
      out.faces.push_back(rust::String::lossy(name_of(face)));
      out.colors.push_back(color_of(face, main));
    }
  }
  return out;
}

std::unique_ptr<Shape> read_brep(rust::Str path) {
  auto out = std::make_unique<Shape>();
  BRep_Builder builder;
  if (!BRepTools::Read(out->shape, std::string(path).c_str(), builder) || out->shape.IsNull()) throw std::runtime_error("not a readable BREP file");
  return out;
}

// Without triangles and in the oldest version, which every program that links OpenCASCADE reads.
void write_brep(const Shape& s, rust::Str path) {
  if (!BRepTools::Write(s.shape, std::string(path).c_str(), false, false, TopTools_FormatVersion_VERSION_1))
    throw std::runtime_error("the BREP file could not be written");
}

std::unique_ptr<Shape> read_iges(rust::Str path) {
  IGESControl_Reader reader;
  Interface_Static::SetCVal("xstep.cascade.unit", "MM");
  if (reader.ReadFile(std::string(path).c_str()) != IFSelect_RetDone) throw std::runtime_error("not a readable IGES file");
  return transferred(reader, "IGES");
}

void write_iges(const Shape& s, rust::Str path, const StepNames& names) {
  IGESControl_Controller::Init();
  set_uncertainty(names.uncertainty);
  constexpr int solids = 1;  // manifold solids (entity 186), not loose trimmed surfaces
  IGESControl_Writer writer("MM", solids);
  if (!writer.AddShape(s.shape)) throw std::runtime_error("the shape could not be translated to IGES");
  writer.ComputeModel();
  IGESData_GlobalSection header = writer.Model()->GlobalSection();
  header.SetFileName(text(names.product));
  header.SetSendName(text(names.product));
  header.SetReceiveName(text(names.product));
  // Without these the writer gives away the login name.
  header.SetAuthorName(text(names.author));
  header.SetCompanyName(text(names.organization));
  header.SetSystemId(text(names.system));
  if (!names.time_stamp.empty()) {
    header.SetDate(text(names.time_stamp));
    header.SetLastChangeDate(text(names.time_stamp));
  }
  writer.Model()->SetGlobalSection(header);
  if (!writer.Write(std::string(path).c_str())) throw std::runtime_error("the IGES file could not be written");
}

}  // namespace grassfire
